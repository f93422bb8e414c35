"""What speed costs and what accuracy costs."""

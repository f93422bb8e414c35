"""What pictures are made of, and the picture of one run."""

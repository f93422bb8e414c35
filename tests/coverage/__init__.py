"""How much of the code the ordinary suite takes: see __main__.py."""

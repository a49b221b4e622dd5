"""Process models from recorded tests, each with its uncertainty and a verdict."""

"""Control loops: what the plant calls them and which controller block runs them."""

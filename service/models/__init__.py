"""Process models of a loop: identified from its records, or stated by a person."""

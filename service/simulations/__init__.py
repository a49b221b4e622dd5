"""Settings simulated before they are typed, on a stated process; nothing is stored."""

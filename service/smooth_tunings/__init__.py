"""The slowest settings a load permits; nothing is stored."""

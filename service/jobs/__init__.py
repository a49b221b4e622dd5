"""Work that outlives the request that asked for it: durable, watched, stoppable, resumable."""

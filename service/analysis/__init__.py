"""A process with a controller: responses, margins, poles, limits; many loops at once."""

"""Loop sheets: the settings a loop runs with, in versions that are never changed."""

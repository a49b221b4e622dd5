"""Smith predictors with their sweep; nothing is stored."""

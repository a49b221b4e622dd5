"""REST service and command line: uploads, models, tunings, loop sheets and their audit trail."""

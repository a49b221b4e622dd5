"""The resources of the API. A new feature adds its router here, and nothing else."""

from service.audit.routes import router as audit
from service.health import router as operation
from service.keys.routes import router as keys
from service.loops.routes import router as loops

ROUTERS = (loops, keys, audit, operation)

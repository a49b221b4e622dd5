"""Alembic environment: takes the connection it is given, or the installation's own database."""

from alembic import context
from sqlalchemy import Connection

from service.database import Database
from service.settings import Settings
from service.tables import Table


def run(connection: Connection) -> None:
    """Run the migrations in one transaction, which the connection's owner ends."""
    context.configure(connection=connection, target_metadata=Table.metadata, transactional_ddl=True)
    with context.begin_transaction():
        context.run_migrations()


given = context.config.attributes.get("connection")
if given is not None:
    run(given)
else:
    with Database.at(Settings().url).engine.begin() as own:
        run(own)

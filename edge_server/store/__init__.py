"""The database: tables, transactions, migrations. Rows do not leave this package."""

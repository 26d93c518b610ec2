"""What is kept: tables, transactions, migrations. Rows do not leave this package."""

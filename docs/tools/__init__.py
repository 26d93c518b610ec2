"""Tools of the documentation: `reference` writes pages from code, `source_pages` shows files."""

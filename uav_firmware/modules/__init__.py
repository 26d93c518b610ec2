"""Modules: a thin shell each, reading and writing topics, around pure laws."""

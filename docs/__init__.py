"""The documentation: pages in Markdown, and the tools that build them."""

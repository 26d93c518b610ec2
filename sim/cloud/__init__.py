"""The mock cloud: takes what a farm sends, once in effect, and shows what it holds."""

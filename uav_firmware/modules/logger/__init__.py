"""Flight logs in PX4's format: one ULog file per flight."""

"""Flight logs as PX4 writes them: one ULog file per flight."""

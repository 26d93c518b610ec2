"""The endpoints: one module with a blueprint for each resource."""

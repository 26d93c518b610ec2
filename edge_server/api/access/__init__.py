"""Access to the API: keys and roles, scopes, rate limits, signatures, the audit trail."""

"""What a user may set: definitions, bounds, cross-checks, YAML."""

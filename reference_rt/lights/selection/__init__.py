"""Light samplers: which light a shadow ray is sent to."""

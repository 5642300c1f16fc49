"""F12: light at extreme sizes and distances."""

"""What every run needs: worker processes, provenance, the digest of our sources."""

"""F2: rays that leave a surface do not meet it again."""

"""The result in short, for page and report alike: findings with side, size, place, cure and how sure; ties."""

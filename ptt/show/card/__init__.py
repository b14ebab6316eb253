"""The result card, a diagnosis in short, for the studio's page and the report alike: words, bar and pictures."""

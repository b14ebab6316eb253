"""Weighted least squares of effects and frames, and what it cannot know."""

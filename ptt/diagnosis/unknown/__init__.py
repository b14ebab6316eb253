"""Unknown physics by construction: what varies, times smooth, times where it acts."""

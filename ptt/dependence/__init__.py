"""What an error depends on: free functions of context variables and honest tests."""

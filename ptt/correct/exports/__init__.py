"""What a controller is given: the model as code, as parameters or as tables, and what each form leaves."""

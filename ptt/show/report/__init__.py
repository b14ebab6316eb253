"""The report on one run and one model: its contents are gathered as values, then written as one HTML file.

`gather` computes `contents`; `sections` and the `about_*` modules turn them into `blocks`, which `html` renders.
"""

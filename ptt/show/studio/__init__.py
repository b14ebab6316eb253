"""The studio: a local page on which one looks at a run, adds effects, and watches the error fall.

`session` is the state and knows no browser, `jobs` call the library in a process of their own (`worker`), `figures`
draw, `page*` show, `server` binds it all to 127.0.0.1.
"""

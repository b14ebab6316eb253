"""The studio: a local web page on which one looks at a run, adds effects, and watches the error fall.

`session` is the state of one page, as immutable values that know no browser; `store` keeps it on disk. `controller`
changes it and tells the views (`page*`). `jobs*` call the library in processes of their own (`pool`, `worker`);
`results` are what they return. `*_figure*` make pictures as plotly dictionaries. `server` binds it all to 127.0.0.1,
`guard` keeps other pages out.
"""

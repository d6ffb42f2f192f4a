"""One look for all that is shown: colours, type scale, and the plots that a browser draws.

Start reading at `palette.py`; `assets.py` says which files a page takes, `static/plots.js` is what
every plot in a browser shares.
"""

"""The harness around the notebooks: what turns a page into products to check, cite and make again.

``cli`` reads a command, ``commands`` does it, ``exits`` has the codes; ``pages`` finds and reads
notebooks, ``reach`` says which sources they have, ``batch`` executes them in ``processes``.  In a
notebook, ``publish`` opens and publishes; ``trials`` computes,
``claims`` judges, ``figures`` draws, ``tables`` checks, ``screen`` shows, ``products`` writes.
``changes`` lists rules and values that changed, ``corrections`` finds old values, ``scorecard``
and ``cite`` read the products of all, ``doctor`` checks the machine, ``paths`` knows the folders.
Of the numerical core it imports ``score`` at most.
"""

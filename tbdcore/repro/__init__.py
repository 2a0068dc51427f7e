"""The harness around the notebooks: what turns a page into products to check, cite and make again.

=============  ===========================================================
``paths``      where the repository is
``processes``  signals that end a run, and its processes
``trials``     Monte Carlo over processes
``claims``     published numbers and the verdicts on them
``products``   tables, records, digests, and writing all files or none
``figures``    pictures in one style, and a run's portfolio of products
``screen``     what a page shows a reader
``pages``      notebooks: parameters, algorithm, digest, execution
``batch``      runs and sweeps
``scorecard``  the files that hold all verdicts together
``cite``       what a report needs of a product, and what a file is
``doctor``     whether this machine can run it all
``commands``   what the commands do
``cli``        the command line: words, errors, exit codes
=============  ===========================================================

Of the numerical core it imports ``score`` at most.
"""

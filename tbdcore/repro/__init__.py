"""The harness around the notebooks: what turns a page into products that can be checked, cited and
made again.

``paths``    where the repository is            ``pages``   notebooks as objects: parameters, algorithm, execution
``trials``   Monte Carlo over processes          ``batch``   runs and sweeps
``claims``   published numbers and verdicts      ``cite``    what a report needs
``figures``  pictures and tables                 ``doctor``  whether this machine can run it
``cli``      the command line

Of the numerical core it imports ``score`` at most.
"""

"""What the property tests share."""

import warnings


def public(name, *modules):
    """The function of this name in one of the modules."""
    return next(getattr(module, name) for module in modules if hasattr(module, name))


def result(function, *args):
    """What the function returns, or None after a ValueError of one line; warnings are errors."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            return function(*args)
        except ValueError as error:
            message = str(error)
    assert message
    assert len(message.splitlines()) == 1
    return None

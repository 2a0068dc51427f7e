"""The compiled loops of the papers, one module a paper; what two papers use is in ``tbdcore``."""

__all__ = ["dp_tbd", "ljipda_ai", "mda_tbd", "mm_pf_tbd", "track_cfar"]

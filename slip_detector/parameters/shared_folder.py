"""The folder with the files that come with the package: configurations and scenes."""

from pathlib import Path


def shared_folder() -> Path:
    """Return the folder that holds ``config``: the source tree's or the installed package's.

    Raises
    ------
    ValueError
        When the package was installed without it.

    Examples
    --------
    >>> (shared_folder() / 'config' / 'slip_detector.yaml').is_file()
    True
    """
    for parent in Path(__file__).resolve().parents:
        for folder in (parent, parent / 'share' / 'slip_detector'):
            if (folder / 'config' / 'scenes').is_dir() and (folder / 'package.xml').is_file():
                return folder
    raise ValueError('the package was installed without its config folder: install it again')

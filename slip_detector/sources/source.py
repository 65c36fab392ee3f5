"""The interface of all sources."""

from collections import Counter

from slip_detector.chain.samples import Samples

#: The longest time that reading a live source waits for something to come.
WAIT_S = 0.1


class Source:
    """Where samples come from.

    A scene and a recording give as many samples as are asked for, stamped from 0 on, and come to
    an end. A live source gives what its sensor sends, stamped by the receiver's clock; the
    attributes from ``connected`` on say how it goes.

    Attributes
    ----------
    name : str
        What it is, for people.
    channel_names : tuple of str
    sample_rate_hz : float
        0 where it is not known.
    is_live : bool
        Whether a sensor sends the samples when it likes.
    has_object : bool
        Whether :meth:`hold_force` has an effect: the fingertip holds an object.
    connected : bool
        Whether the sensor can be listened to.
    state : str
        What is listened to, or why it cannot be.
    counts : Counter of str
        What came and what was dropped, as the decoders count it.
    """

    is_live = False

    def __init__(self, name: str, channel_names: tuple[str, ...], sample_rate_hz: float) -> None:
        self.name = name
        self.channel_names = channel_names
        self.sample_rate_hz = sample_rate_hz
        self.has_object = False
        self.connected = not self.is_live
        self.state = ''
        self.counts: Counter[str] = Counter()

    def start(self) -> None:
        """Begin to listen, if this is live: what the sensor sent before is not given.

        Raises
        ------
        ValueError
            When a parameter does not allow it. A serial port that is not there is waited for.
        """

    def read(self, n: int) -> Samples:
        """Return the next samples.

        Parameters
        ----------
        n
            How many; a live source does not look at it.

        Returns
        -------
        Samples
            At most ``n``, and none only at the end. Of a live source: what came, after waiting
            at most ``WAIT_S`` for it, perhaps none.

        Raises
        ------
        ValueError
            When a recording turns out to be broken; names it.
        """
        raise NotImplementedError

    def hold_force(self, force_n: float) -> None:
        """Hold the object with another grip force from the next sample on.

        Raises
        ------
        ValueError
            When the force is out of range, or there is no object.
        """
        raise ValueError(f'{self.name} has no object to hold')

    def close(self) -> None:
        """Release what is read or listened to."""

"""The one tree of exceptions.

FlaneurError
├── WrongInput               the user can mend it: exit 2
│   ├── BadSurvey            not a survey, empty, or its metadata does not hold
│   ├── UnknownCrs           a coordinate system is missing, unknown or cannot be converted
│   ├── BadTruth             a ground truth of no known format, or its names do not hold
│   ├── BadConfig            an option or a combination of options makes no sense
│   └── BadIndex             not an index, a future format, or a damaged one
├── VocabularyMismatch       postings or words of different codebooks were put together: exit 1
├── BrokerUnreachable        no server answers at the broker's address: exit 1
├── TaskFailed               a shard, channel or query could not be worked on; names it: exit 1
├── Refused                  a worker does not do such work: other version, other roots: exit 1
├── Cancelled                a person cancelled the job or batch: exit 1
└── UnusableImage            one image cannot be used; caught where a reason is recorded
"""


class FlaneurError(Exception):
    """Base of all errors raised on purpose. The message says what to mend."""


class WrongInput(FlaneurError):
    """What was given cannot be worked with; the command line exits with 2."""


class BadSurvey(WrongInput):
    """Not a survey, an empty one, or one whose metadata does not hold."""


class UnknownCrs(WrongInput):
    """A coordinate reference system is missing, unknown, or has no exact enough conversion."""


class BadTruth(WrongInput):
    """A ground truth of no known format, or one that names no indexed image, or several."""


class BadConfig(WrongInput):
    """An option, or a combination of options, makes no sense."""


class BadIndex(WrongInput):
    """Not an index, one of a later format, or a damaged one."""


class VocabularyMismatch(FlaneurError):
    """Postings or words of different codebooks were put together."""


class BrokerUnreachable(FlaneurError):
    """No server answers at the broker's address."""


class TaskFailed(FlaneurError):
    """A shard, channel or query could not be worked on; the message names it."""


class Refused(FlaneurError):
    """A worker does not take such work: it is of another version, or a path is not for it."""


class Cancelled(FlaneurError):
    """A person cancelled the job or the batch while it was at work."""


class UnusableImage(FlaneurError):
    """One image cannot be used; its message is the reason that gets recorded."""

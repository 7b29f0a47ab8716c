//! Values of labels: each an enum with all of its values and their texts.

/// Stage of work on a camera's frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// The Gaussian mixture.
    Background,
    /// Soft mask, labels and blobs.
    Segment,
    /// Blobs linked over time.
    Track,
}

impl Stage {
    /// All of them, in the order in which a frame meets them.
    pub const ALL: [Self; 3] = [Self::Background, Self::Segment, Self::Track];

    /// The label's value.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Background => "background",
            Self::Segment => "segment",
            Self::Track => "track",
        }
    }
}

/// Reason for which a frame never became an observation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DropReason {
    /// The next stage was still busy with earlier frames of a live camera.
    Overrun,
    /// Its time is not after that of the frame before it.
    OutOfOrder,
    /// A newer frame of a live camera came before it was taken.
    Replaced,
    /// It could not be decoded whole.
    Damaged,
    /// Privacy zones of the camera changed while it was worked on.
    Hidden,
}

impl DropReason {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::Overrun, Self::OutOfOrder, Self::Replaced, Self::Damaged, Self::Hidden];

    /// The label's value.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Overrun => "overrun",
            Self::OutOfOrder => "out_of_order",
            Self::Replaced => "replaced",
            Self::Damaged => "damaged",
            Self::Hidden => "hidden",
        }
    }
}

/// Reason for which a frame of a camera that is recorded is not on the disk.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RecordingDrop {
    /// More frames waited for the disk than may.
    QueueFull,
    /// Without the key frame before it, it cannot be decoded.
    NoKeyFrame,
    /// Its time lies before what its segment holds.
    OutOfOrder,
    /// Something is recorded of its time already.
    Overlap,
    /// Recording is paused.
    Paused,
    /// The daemon stopped before it was written.
    Stopping,
}

impl RecordingDrop {
    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::QueueFull, Self::NoKeyFrame, Self::OutOfOrder, Self::Overlap, Self::Paused, Self::Stopping];

    /// The label's value.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::QueueFull => "queue_full",
            Self::NoKeyFrame => "no_key_frame",
            Self::OutOfOrder => "out_of_order",
            Self::Overlap => "overlap",
            Self::Paused => "paused",
            Self::Stopping => "stopping",
        }
    }
}

/// Reason for which a recorded segment was removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum RemovalReason {
    /// `archive.max_gib`.
    Bytes,
    /// `archive.max_age_days`.
    Age,
}

impl RemovalReason {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Bytes, Self::Age];

    /// The label's value.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Bytes => "bytes",
            Self::Age => "age",
        }
    }
}

/// Reason for which a snapshot was not made.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SnapshotFailure {
    /// The disk, or what snapshots may take, is full.
    NoRoom,
    /// As many are made as may be.
    Busy,
    /// There was no picture.
    NoPicture,
    /// A frame or the scene was another before it could be kept.
    Gone,
    /// The disk failed.
    Disk,
    /// The database failed.
    Database,
    /// A fault of the daemon.
    Internal,
}

impl SnapshotFailure {
    /// All of them.
    pub const ALL: [Self; 7] =
        [Self::NoRoom, Self::Busy, Self::NoPicture, Self::Gone, Self::Disk, Self::Database, Self::Internal];

    /// The label's value.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::NoRoom => "no_room",
            Self::Busy => "busy",
            Self::NoPicture => "no_picture",
            Self::Gone => "gone",
            Self::Disk => "disk",
            Self::Database => "database",
            Self::Internal => "internal",
        }
    }
}

/// Reason for which a snapshot was removed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SnapshotRemoval {
    /// Somebody asked for it.
    Asked,
    /// All together were too large.
    Bytes,
    /// It was too old.
    Age,
}

impl SnapshotRemoval {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Asked, Self::Bytes, Self::Age];

    /// As the table, metrics and removals' files have it.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::Asked => "asked",
            Self::Bytes => "bytes",
            Self::Age => "age",
        }
    }
}

/// Reason for which a view was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ViewRefusal {
    /// `render.queue_length` pictures waited already.
    QueueFull,
    /// The pictures that waited already take too many bytes.
    QueueBytes,
    /// The user has as many waiting pictures as their share allows.
    UserShare,
    /// The user's pictures that waited already take as many bytes as are their share.
    UserBytes,
    /// It was waited for `render.timeout_secs`.
    Late,
    /// There was no GPU to draw it.
    NoRenderer,
    /// No settings were fast enough for its deadline.
    Deadline,
}

impl ViewRefusal {
    /// All of them.
    pub const ALL: [Self; 7] = [
        Self::QueueFull,
        Self::QueueBytes,
        Self::UserShare,
        Self::UserBytes,
        Self::Late,
        Self::NoRenderer,
        Self::Deadline,
    ];

    /// The label's value.
    #[must_use]
    pub const fn as_str(self) -> &'static str {
        match self {
            Self::QueueFull => "queue_full",
            Self::QueueBytes => "queue_bytes",
            Self::UserShare => "user_share",
            Self::UserBytes => "user_bytes",
            Self::Late => "late",
            Self::NoRenderer => "no_renderer",
            Self::Deadline => "deadline",
        }
    }
}

//! Why a GPU did not do what it was asked to do.

/// Every failure of a GPU. Callers decide by the kind; the texts are for people.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum GpuError {
    /// No adapter is suitable. The text is a full sentence.
    #[error("{0}")]
    Absent(String),
    /// The GPU does not have enough memory for a texture of this size.
    #[error("the GPU does not have enough memory")]
    OutOfMemory,
    /// The device is gone, for example because its driver was reset.
    #[error("the GPU was lost: {0}")]
    Lost(String),
    /// The GPU refused a command, a shader or a buffer.
    #[error("the GPU refused: {0}")]
    Refused(String),
}

//! Updates: doing only what has changed since a finished run of the same job. The folders of the parts stay, with all that their phases left.
//! Each phase has a key, a hash of everything that it was done with ([`crate::run::part_entries::Done`]): a phase that would have another key now is
//! done again, and with it those that follow from it.

pub(crate) mod changes;
pub(crate) mod mending;

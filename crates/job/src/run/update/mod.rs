//! Updates: doing only what has changed since a finished run of the same job. The folders of the parts stay, with all that their phases left.
//! Each phase has a key, which tells what it was done with from what it would be done with now ([`crate::run::done::Done`]): a phase whose
//! key is another one is done again, and with it those that follow from it.

pub(crate) mod changes;
pub(crate) mod first_plan_file;
pub(crate) mod outdated;

//! GPS software receiver.

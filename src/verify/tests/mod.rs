//! Rules on hand-made folders.

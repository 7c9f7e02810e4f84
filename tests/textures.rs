//! Textures as a job sees them: patterns, drawings, tiles, real files.

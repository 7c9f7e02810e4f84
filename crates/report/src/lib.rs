//! What a person looks at: the scene of a job, pictures, run sheets, reports; and the job folder that holds it all.

pub mod job_folder;
mod measured;
mod raster;
pub mod report;
pub mod scene;
pub mod view;

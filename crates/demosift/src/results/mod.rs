//! What the stages found, and what is concluded from it: how sure it is, how it is compared, written and reported.

pub mod artifact;
pub mod data_only;
pub mod decline;
pub mod figure;
pub mod gain;
pub mod metrics;
pub mod oracle;
pub mod panel;
mod protobuf;
pub mod recording;
pub mod report;
pub mod standing;
pub mod tensorboard;
pub mod uncertainty;

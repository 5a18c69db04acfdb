//! The learning rules, none of which knows another, and how an agent learns from one demonstration by them.

pub mod adapt;
pub mod advantage;
pub mod behavioral_cloning;
pub mod gail;
pub mod mutual_information;
pub mod trpo;

//! One job on every system, estimated: research beside the product.

pub mod compare;
pub mod nurbs;

//! Integration tests, one module a theme.

mod common;
mod physics;
mod scenes;

//! Apps with loops on threads, in real time.

mod mesh_threaded_app;
mod threaded_app;

//! Headless apps in lock step.

mod appearing_app;
mod block_parts_app;
mod body_state_app;
mod coupled_app;
mod diagnostics_app;
mod events_app;
mod grasped_app;
mod hid_app;
mod invalid_app;
mod lockstep_app;
mod mesh_app;
mod mesh_files_app;
mod mesh_parts_app;
mod mesh_refused_app;
mod mesh_reload_app;
mod model_time_app;
mod no_force_app;
mod observed_events;
mod pressed_app;
mod queries_app;
mod reflected_app;
mod schedule_app;
mod several_app;
mod surroundings_app;
mod testing_app;
mod two_bodies_app;

//! Responses, Hankel singular values and states of a mesh as CSV.

use super::analysis::{Analysis, Response};
use palpate_lab::output::csv;

type Column = (String, Vec<f64>);

impl Analysis {
    pub(super) fn response_csv(&self) -> String {
        let columns = |name: &str, response: &Response| -> Vec<Column> {
            let column = |what: &str, values: &Vec<f64>| (format!("{name}_{what}"), values.clone());
            let mut all = vec![
                column("normal_abs_n_per_m", &response.normal_abs_n_per_m),
                column("normal_phase_rad", &response.normal_phase_rad),
            ];
            all.extend(response.tangential_abs_n_per_m.iter().map(|v| column("tangential_abs_n_per_m", v)));
            all.extend(response.tangential_phase_rad.iter().map(|v| column("tangential_phase_rad", v)));
            all
        };
        let mut all = vec![("frequency_hz".to_owned(), self.report.response.frequency_hz.clone())];
        all.extend(columns("full", &self.report.response));
        all.extend(columns("reduced", &self.report.reduced_response));
        all.extend(self.balanced.iter().flat_map(|response| columns("balanced", response)));
        csv(&all)
    }

    pub(super) fn hankel_csv(&self) -> Option<String> {
        let values = self.report.hankel_singular_values.clone()?;
        let index = (1..=values.len()).map(|i| i as f64).collect();
        Some(csv(&[("index".to_owned(), index), ("hankel_singular_value_n_per_m".to_owned(), values)]))
    }

    /// Displacement of each node in each state (Fig. 6), relative to the maximum of that state.
    pub(crate) fn state_magnitudes(&self) -> Option<Vec<Vec<f64>>> {
        let states = self.states.as_ref()?;
        let nodes = (self.specimen.cells + 1).pow(self.specimen.dimension as u32);
        let magnitudes = (0..states.ncols()).map(|state| {
            let mut squared = vec![0.0; nodes];
            for (row, &(node, _)) in self.full.place.iter().enumerate() {
                squared[node] += states[(row, state)].powi(2);
            }
            let largest = squared.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
            squared.iter().map(|s| (s / largest).sqrt()).collect()
        });
        Some(magnitudes.collect())
    }

    pub(super) fn states_csv(&self) -> Option<String> {
        let grid: Vec<[usize; 3]> = self.specimen.lattice().ok()?.grid().collect();
        let axis = |name: &str, axis: usize| -> Column {
            (name.to_owned(), grid.iter().map(|ijk| ijk[axis] as f64).collect())
        };
        let mut all = vec![axis("i", 0), axis("j", 1), axis("k", 2)];
        let states = self.state_magnitudes()?.into_iter().enumerate();
        all.extend(states.map(|(i, state)| (format!("state_{}", i + 1), state)));
        Some(csv(&all))
    }
}

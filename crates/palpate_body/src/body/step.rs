//! Time stepping of a body.

use super::joint_step::advance_joint;
use super::shared_tool::SharedTool;
use super::{Body, StepReport};
use crate::energy::EnergyLedger;
use crate::{BodyError, Integrator, ToolContact, ToolPoint};
use glam::DVec3;

/// A tool and its path during an advance.
#[derive(Debug)]
pub struct ToolRun<'a> {
    /// Contact of the tool with the body.
    pub contact: &'a mut ToolContact,
    /// `path[0]` is the tool's point at the end of the previous step, `path[i]` at the end of tick i.
    pub path: &'a [ToolPoint],
}

impl Body {
    /// Advances by `ticks` ticks while the tool follows its path. `path[0]` is its point at the end of the previous
    /// step, `path[i]` at the end of tick i. Between two points its position is linear, and its velocity is that of
    /// the later point.
    ///
    /// # Errors
    /// [`BodyError::PathLength`] and [`BodyError::Path`] for a path of the wrong length or with values that are not
    /// finite; [`BodyError::InvalidNode`] for a contact with another body; [`BodyError::Parameter`],
    /// [`BodyError::Substeps`], [`BodyError::TooLarge`], [`BodyError::NotConverged`] and [`BodyError::Indefinite`] if
    /// the integrator cannot take the step; [`BodyError::Diverged`] if a value is no longer finite. Body and tool are
    /// then unchanged.
    pub fn advance(
        &mut self,
        tool: Option<(&mut ToolContact, &[ToolPoint])>,
        ticks: usize,
        integrator: impl Into<Integrator>,
    ) -> Result<StepReport, BodyError> {
        self.advance_observed(tool, ticks, integrator, |_, _| ())
    }

    /// [`Body::advance`] with an observer. `observe` gets the number of each tick (from 1) and the force that the
    /// body then displays to the tool, N. If a step spans several ticks, it is called after the last of them.
    ///
    /// # Errors
    /// As [`Body::advance`].
    pub fn advance_observed(
        &mut self,
        tool: Option<(&mut ToolContact, &[ToolPoint])>,
        ticks: usize,
        integrator: impl Into<Integrator>,
        mut observe: impl FnMut(usize, DVec3),
    ) -> Result<StepReport, BodyError> {
        let has_tool = tool.is_some();
        let mut tools: Vec<ToolRun<'_>> =
            tool.into_iter().map(|(contact, path)| ToolRun { contact, path }).collect();
        let mut on_tick = |tick: usize, forces: &[DVec3]| match forces {
            [force] if has_tool => observe(tick, *force),
            _ => observe(tick, DVec3::ZERO),
        };
        self.advance_tools(&mut tools, ticks, integrator, &mut on_tick)
    }

    /// [`Body::advance_observed`] with several tools, of which at most one may drive a node. `observe` gets the
    /// displayed forces of all tools in their order.
    ///
    /// # Errors
    /// As [`Body::advance`]; [`BodyError::InvalidNode`] also if two tools drive nodes.
    pub fn advance_tools(
        &mut self,
        tools: &mut [ToolRun<'_>],
        ticks: usize,
        integrator: impl Into<Integrator>,
        mut observe: impl FnMut(usize, &[DVec3]),
    ) -> Result<StepReport, BodyError> {
        let mut tools: Vec<SharedTool<'_>> = tools
            .iter_mut()
            .map(|ToolRun { contact, path }| SharedTool { contacts: vec![(0, &mut **contact)], path })
            .collect();
        let stepped = advance_joint(&mut [self], &mut tools, ticks, &integrator.into(), &mut observe);
        let reports = stepped.map_err(|(_, error)| error)?;
        Ok(reports.into_iter().next().unwrap_or_default())
    }

    /// Starts energy accounting from zero; see [`Body::energy_balance`].
    pub fn start_energy_accounting(&mut self) {
        self.ledger = Some(EnergyLedger::start(self));
    }
}

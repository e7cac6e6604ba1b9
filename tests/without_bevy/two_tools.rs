//! Two tools close to each other on one body: each loop follows the present force of the other one, against the full body with both.

use glam::DVec3;
use palpate_body::*;
use palpate_local::{
    HandOver, HandOverSettings, LocalModel, ModelId, OtherToolForce, Sample, Scheme, SubmitResult,
};
use palpate_reduce::*;
use palpate_tests_without_bevy::samples;

const PERIOD: usize = 50;
const BODY: u64 = 1;

fn lattice() -> Body {
    let lattice = UniformLattice { stiffness_n_per_m: 100.0, damping_ratio: 0.7, mass_kg: 1.0 };
    let made = Block::new([6; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).uniform(&lattice).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

fn tissue(youngs_modulus_pa: f64) -> Body {
    let tissue = Tissue { youngs_modulus_pa, ..Tissue::default() };
    let made = Block::new([6; 3], DVec3::splat(0.1)).unwrap().fix(Face::NegZ).tissue(&tissue).unwrap();
    Body::new(made.network, made.surface).unwrap()
}

fn ball(identity: u64) -> ToolContact {
    let coupling = VirtualCoupling { stiffness_n_per_m: 20e3, max_force_n: 10.0 };
    let ball = ToolContact::touch(ToolShape::Sphere { radius_m: 0.01 }, 0.3).unwrap();
    ball.with_coupling(coupling).unwrap().with_identity(identity)
}

/// Forces of the full body and of the loops on both tools.
struct Run {
    oracle: [Vec<DVec3>; 2],
    rendered: [Vec<DVec3>; 2],
}

impl Run {
    fn error(&self, tool: usize) -> f64 {
        relative_rms_error(&self.rendered[tool][100..], &self.oracle[tool][100..]).unwrap()
    }
}

/// How a pair of loops is run.
#[derive(Clone, Copy)]
struct Variant {
    /// Delay of the local models, in ticks.
    delay: usize,
    /// Whether each loop follows the present force of the other tool. Without, it holds that force constant.
    follows: bool,
}

/// Both loops in lock step, tick by tick.
struct LoopPair {
    variant: Variant,
    // Boxed because of their size.
    loops: [Box<HandOver>; 2],
    pending: [Vec<(usize, LocalModel)>; 2],
    rendered: [Vec<DVec3>; 2],
}

impl LoopPair {
    fn new(variant: Variant, settings: HandOverSettings) -> Self {
        let loops = [(); 2].map(|()| Box::new(HandOver::new(settings).unwrap()));
        Self { variant, loops, pending: Default::default(), rendered: Default::default() }
    }

    fn tick(&mut self, tick: usize, samples: [Sample; 2]) {
        for (tool, sample) in samples.into_iter().enumerate() {
            let [(_, force_n), _] = self.loops[1 - tool].forces_on_bodies_n();
            let other = OtherToolForce { tool: 12 - tool as u64, body: BODY, force_n };
            let (hand_over, pending) = (&mut self.loops[tool], &mut self.pending[tool]);
            let has_force = self.variant.follows && hand_over.active().is_some();
            hand_over.push(Sample { other: has_force.then_some(other), ..sample });
            if hand_over.is_ready() && pending.first().is_some_and(|(at, _)| *at <= tick) {
                let (_, model) = pending.remove(0);
                assert_eq!(hand_over.submit(&model), SubmitResult::Accepted);
            }
            self.rendered[tool].push(hand_over.render().force_n);
        }
    }
}

/// Runs the full body along `paths`, and a pair of loops for each of `variants`. The paths are prescribed, so all loops get the local models
/// of one run of the body.
fn run<const N: usize>(body: &Body, paths: [&[Sample]; 2], variants: [Variant; N]) -> [Run; N] {
    let mut body = body.clone();
    let mut contacts = [ball(11), ball(12)];
    let mut builder = LocalModelBuilder::new(&body, BuilderOptions::of(&body)).unwrap();
    let settings = HandOverSettings { capacity: builder.capacity(), ..HandOverSettings::default() };
    let mut pairs = variants.map(|variant| LoopPair::new(variant, settings));
    let points = paths.map(|path| {
        path.iter()
            .map(|s| ToolPoint { position_m: s.position_m, velocity_m_per_s: s.velocity_m_per_s })
            .collect::<Vec<_>>()
    });
    let mut oracle = [(); 2].map(|()| vec![DVec3::ZERO]);
    for i in 0..paths[0].len() {
        if i > 0 && (i % PERIOD == 0 || i + 1 == paths[0].len()) {
            let from = oracle[0].len() - 1;
            let [a, b] = &mut contacts;
            let mut tools = [
                ToolRun { contact: a, path: &points[0][from..=i] },
                ToolRun { contact: b, path: &points[1][from..=i] },
            ];
            body.advance_tools(&mut tools, i - from, SemiImplicitEuler::default(), |_, f| {
                oracle.iter_mut().zip(f).for_each(|(to, f)| to.push(*f));
            })
            .unwrap();
        }
        if i > 0 && i % PERIOD == 0 {
            for tool in 0..2 {
                let mut model = LocalModel::empty(builder.capacity());
                let id = ModelId { body: BODY, epoch: 0, sequence: i as u64 };
                let (own, other) = ((&contacts[tool], points[tool][i]), [&contacts[1 - tool]]);
                let scheme = Scheme::NearFieldExact;
                builder.build_with_other_tools(scheme, &body, own, &other, id, &mut model).unwrap();
                for pair in &mut pairs {
                    pair.pending[tool].push((i + pair.variant.delay, model.clone()));
                }
            }
        }
        pairs.iter_mut().for_each(|pair| pair.tick(i, paths.map(|path| path[i])));
    }
    pairs.map(|pair| Run { oracle: oracle.clone(), rendered: pair.rendered })
}

#[test]
#[expect(clippy::print_stdout, reason = "the errors are the result of the test")]
fn loops_of_two_tools_feel_each_other_between_model_steps() {
    let top = |x: f64, y: f64, depth_m: f64| DVec3::new(x, y, 0.06 - depth_m);
    let press = |t: f64| 0.005 * (t / 0.2).min(1.0);
    let scenes: [(&str, Body); 3] =
        [("lattice", lattice()), ("tissue", tissue(20e3)), ("stiff tissue", tissue(400e3))];
    for (name, body) in &scenes {
        for apart in [0.012, 0.022] {
            type Motion<'a> = (&'a str, &'a dyn Fn(f64) -> DVec3, &'a dyn Fn(f64) -> DVec3);
            let motions: [Motion<'_>; 2] = [
                ("one rests, one oscillates", &|t| top(-0.5 * apart, 0.004, press(t)), &|t| {
                    top(0.5 * apart, 0.003, press(t) + 0.0025 * (20.0 * t).sin())
                }),
                ("both move", &|t| top(-0.5 * apart, 0.004, press(t) + 0.002 * (14.0 * t).sin()), &|t| {
                    top(0.5 * apart, 0.003 + 0.004 * (9.0 * t).sin(), press(t) + 0.002 * (23.0 * t).cos())
                }),
            ];
            for (motion, a, b) in motions {
                let (a, b) = (samples(1000, a), samples(1000, b));
                let delays = [0, 40];
                let held = delays.map(|delay| Variant { delay, follows: false });
                let followed = delays.map(|delay| Variant { delay, follows: true });
                let runs = run(body, [&a, &b], [held[0], followed[0], held[1], followed[1]]);
                for (delay, runs) in delays.into_iter().zip(runs.as_chunks::<2>().0) {
                    let [held, followed] = runs;
                    let percent = |run: &Run| [0, 1].map(|tool| 100.0 * run.error(tool));
                    let (held, followed) = (percent(held), percent(followed));
                    let most = |of: [f64; 2]| of[0].max(of[1]);
                    assert!(most(followed) < 0.75 * most(held), "{name}, {motion}: {held:?} {followed:?}");
                    assert!(
                        !name.contains("tissue") || most(followed) < 1.0,
                        "{name}, {motion}: {followed:?}"
                    );
                    println!(
                        "{name}, {motion}, {apart} m, {delay} ms: held {held:.2?} %, followed {followed:.2?} %"
                    );
                }
            }
        }
    }
}

/// Two still hands nearly at the same place, the hardest case for forces that are one tick late: the forces come to rest at those of the
/// full body.
#[test]
fn forces_of_still_tools_at_one_place_come_to_rest() {
    for body in [lattice(), tissue(20e3), tissue(400e3)] {
        for apart in [0.002, 0.012] {
            let still = |side: f64| {
                samples(700, |t| DVec3::new(0.5 * side * apart, 0.004, 0.06 - 0.004 * (t / 0.2).min(1.0)))
            };
            let follows = Variant { delay: 40, follows: true };
            let [run] = run(&body, [&still(-1.0), &still(1.0)], [follows]);
            for (rendered, oracle) in run.rendered.iter().zip(&run.oracle) {
                let end = *oracle.last().unwrap();
                assert!(end.z > 0.1, "{end}");
                for pair in rendered[600..].windows(2) {
                    assert!(pair[0].distance(pair[1]) < 2e-3 * end.length(), "{apart} m: {pair:?}");
                    assert!(pair[1].distance(end) < 0.02 * end.length(), "{apart} m: {} {end}", pair[1]);
                }
            }
        }
    }
}

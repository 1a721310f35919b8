"""What BeliefPlanner believes of a maze: evidence, wrong maps, the displacement, and when the belief is revised."""

import numpy as np
import pytest
import torch
from acting import inputs_of
from mazebench_agents.belief_planner import BeliefPlanner
from mazebench_agents.belief_planner.agent import PATIENCE
from mazebench_agents.belief_planner.belief import GOAL, WALL, Belief, belief_losses, probabilities
from mazebench_agents.belief_planner.evidence import FAILED, NUM_EVIDENCE, PASSED, SENSED, Readings, add_readings
from mazebench_agents.belief_planner.framing import framed
from mazebench_agents.belief_planner.learner import NUM_PAST
from mazebench_agents.belief_planner.network import BeliefPlannerNetwork, Propagation, brought_nearer
from mazebench_agents.belief_planner.pictures import past_evidence
from mazebench_agents.belief_planner.scan_match import find_pose, is_odometry
from mazebench_agents.belief_planner.shortest_paths import cheapest_paths
from mazebench_agents.belief_planner.wrong_maps import wrong_map
from mazebench_agents.muzero.network import rotate
from mazebench_agents.robot.odometry import Displacement
from test_muzero import CONFIGS, a_context, an_observation, code_of, make_learner, small_config

from mazebench.agent import Interface
from mazebench.errors import InputError
from mazebench.maps.kinds import generate
from mazebench.tasks.build import make_spec
from mazebench.tasks.context import build_context
from mazebench.tasks.tracks.sketch import draw_by_hand
from mazebench.tasks.tracks.stale import num_movable
from mazebench.world.lidar import MAX_RANGE, Lidar

METRE = np.array([[0, -1], [1, 0]], dtype=np.float32)  # a cell a metre, y up


@pytest.fixture(scope="module")
def mazes():
    return tuple(generate("dfs", 7, np.random.default_rng(index), f"m{index}") for index in range(3))


def planes(size=7):
    return np.zeros((1, NUM_EVIDENCE, size, size), dtype=np.float32)


def a_reading(position, velocity=(0, 0), wished=(0, 0), yaw=0.0, ranges=(), on_leg=True):
    row = (np.array([values], dtype=np.float32) for values in (position, velocity, wished, yaw))
    lidar = np.array([ranges], dtype=np.float32).reshape(1, -1)
    return Readings(np.zeros(1, dtype=np.int64), np.array([on_leg]), *row, lidar)


def test_cell_of_the_body_is_free_and_passed():
    evidence = planes()
    add_readings(evidence, a_reading((2.2, 3.3)), METRE)
    assert evidence[0, SENSED, 2, 3] < -0.3
    assert evidence[0, PASSED, 2, 3] == 1
    assert np.count_nonzero(evidence) == 2
    add_readings(evidence, a_reading((4.0, 1.0), on_leg=False), METRE)
    assert evidence[0, PASSED].sum() == 1
    before = evidence.copy()
    add_readings(evidence, a_reading((2.45, 5.0)), METRE)  # too near to the edge to tell the cell
    add_readings(evidence, a_reading((-3.0, 9.0)), METRE)  # outside
    np.testing.assert_array_equal(evidence, before)


@pytest.mark.parametrize(
    ("position", "velocity", "is_wall"),
    [
        ((2.0, 3.3), (0.0, 0.1), True),
        ((2.0, 3.3), (0.0, 0.8), False),  # not stopped
        ((2.0, 3.0), (0.0, 0.1), False),  # far from the edge
        ((2.45, 3.3), (0.0, 0.1), False),  # beside the corner of two cells
    ],
)
def test_body_that_is_slower_than_it_wished_was_stopped_by_a_wall(position, velocity, is_wall):
    evidence = planes()
    add_readings(evidence, a_reading(position, velocity, wished=(0.0, 0.9)), METRE)
    assert (evidence[0, SENSED, 2, 4] > 0) == is_wall
    assert evidence[0, FAILED].sum() == is_wall


def test_rays_pass_through_free_cells_and_end_at_walls(mazes):
    size, lidar = mazes[0].size, Lidar(mazes)
    for index, maze in enumerate(mazes):
        evidence = planes(size)
        for row, column in np.argwhere(~maze.walls)[::3]:
            x, y, yaw = column + 0.6, size - row - 0.45, 0.3 * row
            ranges = lidar.ranges(np.array([index]), np.array([[x, y, yaw]]))[0]
            add_readings(evidence, a_reading((size - y - 0.5, x - 0.5), yaw=yaw, ranges=ranges), METRE)
        sensed = evidence[0, SENSED]
        told = np.abs(sensed) > 0.3
        assert told.sum() > 0.8 * size**2
        np.testing.assert_array_equal(sensed[told] > 0, maze.walls[told])


def test_ray_that_meets_nothing_tells_of_no_wall():
    evidence = planes(13)
    add_readings(evidence, a_reading((6.0, 6.0), ranges=[MAX_RANGE] * 32), METRE)
    assert evidence.max(initial=0) == 1  # the body's own cell, passed
    assert (evidence[0, SENSED] <= 0).all()


def test_belief_is_the_shown_map_and_what_was_sensed_before_anything_is_learned():
    torch.manual_seed(0)
    shown = a_context(batch=3)[:, [0, 2]]
    evidence = torch.zeros(3, NUM_EVIDENCE, 7, 7)
    believed = probabilities(Belief(8)(shown, evidence), evidence)
    torch.testing.assert_close(believed, shown, atol=0.003, rtol=0)
    evidence[:, SENSED, 2, 2], evidence[:, SENSED, 3, 3] = 1, -1
    evidence[0, PASSED, 1, 5] = 1  # where the goal is marked
    believed = probabilities(Belief(8)(shown, evidence), evidence)
    assert (believed[:, WALL, 2, 2] > 0.99).all()
    assert (believed[:, WALL, 3, 3] < 0.01).all()
    is_free = believed[0, WALL] < 0.5
    assert believed[0, GOAL][is_free].min() > 0.99  # nowhere more than elsewhere
    assert believed[0, GOAL][~is_free].max() < 0.01


def test_cell_that_stops_the_body_again_and_again_is_wall_and_has_no_goal():
    logits, evidence = torch.zeros(1, 2, 7, 7), torch.zeros(1, NUM_EVIDENCE, 7, 7)
    logits[:, GOAL, 2, 2], logits[:, GOAL, 4, 4] = 3.0, 1.0
    believed = [probabilities(logits, evidence)]
    for _ in range(40):
        evidence[:, FAILED, 2, 2] += 1
        believed.append(probabilities(logits, evidence))
    wall = torch.stack([each[0, WALL, 2, 2] for each in believed])
    torch.testing.assert_close(wall, (2 + torch.arange(41)) / (4 + torch.arange(41)))
    assert believed[0][0, GOAL].argmax() == 2 * 7 + 2
    assert believed[-1][0, GOAL].argmax() == 4 * 7 + 4


def test_losses_of_a_belief_by_hand():
    logits = torch.zeros(2, 2, 3, 3)
    logits[0, WALL, 0, 0] = 2.0
    sensed, truth = torch.zeros(2, 3, 3), torch.zeros(2, 2, 3, 3)
    sensed[0, 0, 0], truth[0, WALL, 0, 0] = -1.0, 1.0  # 10 times the weight of another cell
    truth[:, GOAL, 1, 1] = 1.0
    of_wall, of_goal = belief_losses(logits, sensed, truth)
    even, surer = np.log(2), np.log1p(np.exp(-2))
    assert of_wall.item() == pytest.approx((17 * even + 10 * surer) / 27)
    assert of_goal.item() == pytest.approx(np.log(9))


def test_evidence_at_replay_comes_from_the_past_alone(mazes):
    """What is written into the replay after a sample's earliest step changes nothing of its evidence."""
    learner = make_learner(mazes)
    network = learner.actor.network
    network.scale.data.copy_(torch.tensor([[0.0, 0.2], [-0.2, 0.0]]))
    sample = learner.replay.sample_sequences(
        4, 3, 8, hindsight=learner.hindsight, rng=np.random.default_rng(0), num_past=NUM_PAST
    )
    past = sample.past
    assert past.exists[:, -1].all()
    first = sample.state[:, :, 0]
    steps_of = (past.state[:, -1:] == first).all(axis=-1)
    assert steps_of.any(axis=1).all()  # the last row of the past is the earliest step of the group

    def evidence(sample):
        return past_evidence(sample, network, size=7, lidar=learner.lidar, rng=np.random.default_rng(0))

    later = np.random.default_rng(0).normal(size=sample.state.shape)
    np.testing.assert_array_equal(evidence(sample._replace(state=later)), evidence(sample))
    assert np.count_nonzero(evidence(sample))


def test_positions_are_believed_where_they_are_exact_and_filtered_where_they_are_noisy():
    rng = np.random.default_rng(0)
    filtered = Displacement(2)
    true, errors = np.zeros(2), []
    for step in range(150):
        velocity = np.array([np.cos(step / 20), np.sin(step / 20)])
        state = np.zeros((2, 12), dtype=np.float32)
        state[:, 5] = 0.7
        turn = np.array([[np.cos(0.7), np.sin(0.7)], [-np.sin(0.7), np.cos(0.7)]])
        state[:, 6:8] = turn @ velocity
        true = true + 0.16 * velocity * (step > 0)
        state[:, :2] = np.array([5.0, 8.0]) + true
        state[1, :2] += rng.normal(size=2)
        moved = filtered.update(state, np.full(2, step == 0))
        np.testing.assert_allclose(moved[0], true, atol=1e-5)
        errors.append(np.linalg.norm(moved[1] - true))
    assert np.mean(errors) < 0.35
    assert filtered.update(state, np.ones(2, dtype=bool)).tolist() == [[0, 0], [0, 0]]


def test_drawing_of_more_pixels_than_cells_is_framed_to_its_cells():
    rng = np.random.default_rng(1)
    agreement, marks = [], []
    for _ in range(20):
        maze = generate("dfs", 13, rng, "m")
        cells = [tuple(map(int, cell)) for cell in rng.permutation(np.argwhere(~maze.walls))[:2]]
        drawing = draw_by_hand(13, 0.5, rng)
        picture = drawing.picture(maze.walls)
        context = build_context(picture, *(drawing.pixel(cell, picture) for cell in cells), 26)
        shown, starts = framed(context, 13)
        agreement.append(((shown[WALL] > 0.5) == maze.walls).mean())
        for mark, cell in ((starts, cells[0]), (np.argwhere(shown[GOAL]), cells[1])):
            marks.append(np.abs(mark[0] - cell).max())
    assert np.mean(agreement) > 0.8
    assert np.mean(np.array(marks) <= 1) == 1


def test_wrong_maps_mark_the_goal_and_are_wrong():
    rng = np.random.default_rng(0)
    maze = generate("dfs", 13, rng, "m")
    free = [tuple(map(int, cell)) for cell in np.argwhere(~maze.walls)]
    shares = []
    for _ in range(200):
        start, goal = (free[index] for index in rng.choice(len(free), 2))
        shown = wrong_map(maze.walls, start, goal, rng)
        assert shown.shape == (2, 13, 13)
        assert shown[GOAL].sum() == 1
        assert np.abs(np.argwhere(shown[GOAL])[0] - goal).max() <= 4
        shares.append(((shown[WALL] > 0.5) != maze.walls).mean())
    assert 0.05 < np.mean(shares) < 0.4


def test_maze_without_movable_doors_is_drawn_wrong_all_the_same():
    walls = np.pad(np.zeros((4, 4), dtype=bool), 1, constant_values=True)
    assert num_movable(walls) == 0
    for seed in range(20):
        wrong_map(walls, (1, 1), (4, 4), np.random.default_rng(seed))


def test_learner_wants_contexts_of_the_mazes_size(mazes):
    with pytest.raises(InputError, match="contexts of the mazes' size, found mazes of 7 and a context of 5"):
        BeliefPlanner.build_learner(make_spec(maps=mazes, distances=(1, 2, 3), context_size=5))


def an_agent(size=7):
    torch.manual_seed(0)
    agent = BeliefPlanner(CONFIGS["belief-planner"], size)
    with torch.no_grad():
        agent.network.scale.copy_(torch.tensor([[0.0, 0.2], [-0.2, 0.0]]))
    return agent


def move(state, x, y):
    """Moves bodies from the origin, with the velocity that this takes."""
    state[:, :2] = x, y
    state[:, 6:8] = 2 * x / 0.16, 2 * y / 0.16


def test_belief_is_revised_where_evidence_contradicts_it_and_only_there():
    agent = an_agent()
    context = np.zeros((2, 4, 7, 7), dtype=np.float32)
    context[:, 2, 1, 5] = context[:, 3, 5, 1] = 1
    context[0, 0, 5, 2] = 1  # a wall is shown in front of the first body, none in front of the second
    state = np.zeros((2, 12), dtype=np.float32)
    memory = agent.initial_state(2)
    _, memory = agent.act(inputs_of({"state": state, "context": context}, np.ones(2, dtype=bool)), memory)
    revised = []
    move(state, 1.0, 0.0)  # both bodies are a cell further right now
    for _ in range(PATIENCE + 2):
        _, memory = agent.act(inputs_of({"state": state, "context": context}, np.zeros(2, dtype=bool)), memory)
        revised.append(np.flatnonzero(memory.waited == 0).tolist())
    assert [rows for rows in revised if rows] == [[0]]  # once, when it has waited long enough
    assert memory.evidence[0, SENSED, 5, 2] < 0
    assert np.abs(memory.belief[0] - memory.belief[1]).max() > 0


def test_anchor_and_evidence_last_through_the_landmarks_of_an_episode():
    agent = an_agent()
    context = a_context(batch=2).numpy()
    context[:, :2] = 0
    state = np.zeros((2, 12), dtype=np.float32)
    memory = agent.initial_state(2)
    every = np.ones(2, dtype=bool)
    _, memory = agent.act(inputs_of({"state": state, "context": context}, every), memory)
    move(state, 0.8, 1.1)
    context[:, 3] = 0
    context[:, 3, 4, 3] = 1  # not where the body is
    _, memory = agent.act(inputs_of({"state": state, "context": context}, every, np.array([False, True])), memory)
    np.testing.assert_array_equal(memory.anchor, [[5, 1], [4, 3]])
    assert (memory.evidence[:, SENSED] != 0).sum(axis=(1, 2)).tolist() == [2, 1]
    assert (memory.evidence[:, PASSED] != 0).sum(axis=(1, 2)).tolist() == [1, 1]


@pytest.mark.parametrize(
    ("x", "size", "cell_size", "expected"),
    [
        (4.5, 7, 1.0, (2, 4)),  # a cell's centre is believed, wherever the start is marked
        (4.7, 7, 1.0, (5, 1)),  # noise
        (0.0, 7, 1.0, (5, 1)),  # odometry
        (4.5, 7, 2.0, (5, 1)),  # cells of two metres
        (4.5, 15, 1.0, (5, 1)),  # a map with fewer pixels than the maze has cells
    ],
)
def test_episode_begins_where_the_position_says_or_else_where_the_start_is_marked(x, size, cell_size, expected):
    interface = Interface("local", size, 7, cell_size=cell_size)
    agent = BeliefPlanner.build(interface)
    context = np.zeros((1, 4, 7, 7), dtype=np.float32)
    context[:, 2, 1, 5] = context[:, 3, 5, 1] = 1
    state = np.zeros((1, 12), dtype=np.float32)
    state[:, :2] = x, 4.5
    _, memory = agent.act(
        inputs_of({"state": state, "context": context}, np.ones(1, dtype=bool)), agent.initial_state(1)
    )
    np.testing.assert_array_equal(memory.anchor[0], expected)


def test_goal_is_believed_elsewhere_where_the_body_has_passed_it():
    agent = an_agent()
    with torch.no_grad():  # a belief that has learned that the goal is not where the body was
        agent.network.belief.forward = lambda shown, evidence: torch.stack(
            [torch.full_like(shown[:, 0], -9.0), 5 * shown[:, GOAL] - 9 * evidence[:, PASSED]], dim=1
        )
    context = np.zeros((1, 4, 7, 7), dtype=np.float32)
    context[:, 2, 5, 2] = context[:, 3, 5, 1] = 1
    state = np.zeros((1, 12), dtype=np.float32)
    memory = agent.initial_state(1)
    _, memory = agent.act(inputs_of({"state": state, "context": context}, np.ones(1, dtype=bool)), memory)
    assert memory.belief[0, GOAL].argmax() == 5 * 7 + 2
    move(state, 1.0, 0.0)
    for _ in range(PATIENCE):
        _, memory = agent.act(inputs_of({"state": state, "context": context}, np.zeros(1, dtype=bool)), memory)
    assert memory.belief[0, GOAL, 5, 2] < 0.05


def test_cheapest_paths_and_their_gradients_by_relaxation():
    torch.manual_seed(0)
    cost = (torch.rand(4, 6, 6) + 0.5).requires_grad_()
    begin = torch.full((4, 6, 6), 100.0)
    begin[:, 1, 4], begin[:, 5, 0] = 0.0, 2.0
    weight = torch.rand(4, 6, 6)
    distance = begin
    for _ in range(40):
        padded = torch.nn.functional.pad(distance, (1, 1, 1, 1), value=1000.0)
        beside = (padded[:, :-2, 1:-1], padded[:, 2:, 1:-1], padded[:, 1:-1, :-2], padded[:, 1:-1, 2:])
        distance = torch.minimum(distance, cost + torch.stack(beside).amin(dim=0))
    found = cheapest_paths(cost, begin)
    torch.testing.assert_close(found, distance)
    (expected,) = torch.autograd.grad((distance * weight).sum(), cost)
    (gradient,) = torch.autograd.grad((found * weight).sum(), cost)
    torch.testing.assert_close(gradient, expected)


def test_first_reading_of_the_lidar_tells_the_heading_and_mostly_the_cell():
    mazes = tuple(generate("dfs", 13, np.random.default_rng(index), f"m{index}") for index in range(10))
    rng, lidar = np.random.default_rng(0), Lidar(mazes)
    turned, found = [], []
    for index, maze in enumerate(mazes):
        cells = np.argwhere(~maze.walls)
        for row, column in rng.permutation(cells)[:5]:
            yaw = rng.uniform(-np.pi, np.pi)
            ranges = lidar.ranges(np.array([index]), np.array([[column + 0.5, 13 - row - 0.5, yaw]]))[0]
            shown = maze.walls.astype(np.float32)
            _, heading = find_pose(shown, ranges, np.array([[row, column]]), METRE)
            turned.append(np.abs(np.angle(np.exp(1j * (heading - yaw)))))
            cell, _ = find_pose(shown, ranges, cells, METRE)
            found.append(cell.tolist() == [row, column])
    assert np.mean(np.array(turned) < 0.1) > 0.85  # elsewhere the walls look alike in two directions
    assert np.mean(found) > 0.5


def test_pose_at_the_origin_is_odometry():
    state = np.zeros(12, dtype=np.float32)
    assert is_odometry(state)
    state[5] = 0.1
    assert not is_odometry(state)


@pytest.mark.parametrize("is_marked", [True, False])
def test_motion_told_by_odometry_is_turned_to_the_map(is_marked, mazes):
    agent, maze = an_agent(), mazes[0]
    yaw, cell = 0.9, tuple(np.argwhere(~maze.walls)[7])
    ranges = Lidar(mazes).ranges(np.array([0]), np.array([[cell[1] + 0.5, 7 - cell[0] - 0.5, yaw]]))
    context = build_context(maze.walls, cell, (1, 1), 7)[None]
    if not is_marked:
        context[:, 3] = 0
    state = np.zeros((1, 12), dtype=np.float32)
    observation = {"state": state, "context": context, "lidar": ranges.astype(np.float32)}
    memory = agent.initial_state(1)
    _, memory = agent.act(inputs_of(observation, np.ones(1, dtype=bool)), memory)
    assert memory.turn[0] == pytest.approx(yaw, abs=0.1)
    np.testing.assert_array_equal(memory.anchor[0], cell)


def make_propagation():
    """Costs a step to leave a cell whose feature is 0; those whose feature is 1 can't be entered."""
    propagation = Propagation(1, 1)
    with torch.no_grad():
        propagation.cost.weight.zero_()
        propagation.cost.bias.fill_(np.log(np.e - 1) - 2)  # softplus(2 + bias) = 1
    return propagation


def believed(wall, goal):
    """The belief `[1, 2, M, M]` with a goal."""
    planes = torch.zeros(1, 2, *wall.shape)
    planes[0, 0] = wall
    planes[0, 1][goal] = 1
    return planes


def test_propagation_with_equal_costs_is_the_distance_on_the_grid():
    belief = believed(torch.tensor([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 0.0, 0.0]]), (2, 0))
    distance = make_propagation()(torch.zeros(1, 1, 3, 3), belief)[0, 0]
    torch.testing.assert_close(distance[0], torch.tensor([6.0, 5.0, 4.0]))  # around the wall
    torch.testing.assert_close(distance[2], torch.tensor([0.0, 1.0, 2.0]))
    slopes = Propagation.slopes(distance[None, None])[0]  # up, down, left, right
    torch.testing.assert_close(slopes[:, 0, 1], torch.tensor([2.0, 2.0, 1 / 3, -1 / 3]))


@pytest.mark.parametrize(("chance", "expected"), [(0.1, 2 + 12 / 9), (0.5, 6.0)])
def test_cell_that_may_be_wall_costs_the_tries_that_fail_or_the_way_around_it(chance, expected):
    belief = believed(torch.tensor([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 0.0]]), (2, 0))
    belief[0, 0, 1, 0] = chance  # between the start, above, and the goal
    distance = make_propagation()(torch.zeros(1, 1, 3, 3), belief)[0, 0]
    assert distance[0, 0].item() == pytest.approx(expected)


def test_goal_that_may_be_in_two_cells_is_sought_in_the_nearer_one_unless_it_is_improbable():
    belief = believed(torch.zeros(1, 9)[:, :].expand(9, 9), (0, 8))
    for chance, expected in ((0.5, 14.0), (0.9, 3 + 12 / 9)):  # relative to that of the far cell, 14 cells away
        belief[0, 1, 6, 3] = chance
        distance = make_propagation()(torch.zeros(1, 1, 9, 9), belief)[0, 0]
        assert distance[6, 0].item() == pytest.approx(min(expected, 3 + 12 * (1 / chance - 1)))


def test_goals_out_of_reach_are_brought_nearer_and_the_way_stays_the_same():
    distance = torch.arange(0.0, 90.0, 10.0).reshape(1, 1, 3, 3)
    near, far = (brought_nearer(distance, torch.tensor([cell])) for cell in ([1.0, 0.0], [2.0, 2.0]))
    torch.testing.assert_close(near, distance)
    torch.testing.assert_close(far.flatten(), torch.tensor([10.0, 10, 10, 10, 10, 10, 10, 20, 30]))


def test_network_with_the_true_scale_looks_where_the_agent_is():
    network = BeliefPlannerNetwork(small_config())
    with torch.no_grad():
        network.scale.copy_(torch.tensor([[0.0, 0.2], [-0.2, 0.0]]))  # times 5: a cell a metre, y up
        network.hypermodel.sharpness.fill_(20.0)
    code = code_of(network, a_context())
    moved = torch.tensor([[[0.0, 0.0], [2.0, 0.0], [1.0, 3.0]]])
    latent = torch.cat([moved, torch.zeros(1, 3, network.latent_size - 2)], dim=-1)
    seen = network.look(latent, code)
    for k, (row, column) in enumerate([(5, 1), (5, 3), (2, 2)]):
        torch.testing.assert_close(seen[0, k], code.weights[0, row * 7 + column])


def test_free_motion_is_the_same_wherever_the_body_heads():
    """Where the transition network says nothing, a step turned with the body is the step."""
    torch.manual_seed(0)
    network = BeliefPlannerNetwork(small_config())
    torch.nn.init.normal_(network.free_by_action.weight)
    for last in (network.hypermodel.transition.later[-1].weight, network.hypermodel.transition.later[-1].bias):
        torch.nn.init.zeros_(last)
    code = code_of(network, a_context())
    features = torch.randn(1, 1, 9)
    yaw = torch.tensor(0.4)

    def moved_and_heading(yaw):
        features[..., 2:4] = torch.stack([torch.sin(yaw), torch.cos(yaw)])
        latent = network.encode(features)
        first = network.first_layer(latent, network.look(latent, code), code)
        after = network.step(latent, first, torch.tensor([[3]]), code)
        return after[0, 0, :2] - latent[0, 0, :2], after[0, 0, 2:4], after[0, 0, 4:7]

    quarter = torch.tensor([1.0, 0.0])  # sine and cosine of a quarter turn
    (moved, heading, velocities), turned = moved_and_heading(yaw), moved_and_heading(yaw + np.pi / 2)
    torch.testing.assert_close(turned[0], rotate(moved, quarter))
    torch.testing.assert_close(turned[1].flip(-1), rotate(heading.flip(-1), quarter))
    torch.testing.assert_close(turned[2], velocities)
    torch.testing.assert_close(heading.norm(), torch.tensor(1.0))


def test_context_is_encoded_where_it_is_new_and_only_there():
    agent = BeliefPlanner(small_config(), 7)
    observation = an_observation(3)
    _, state = agent.act(inputs_of(observation, np.ones(3, dtype=bool)), agent.initial_state(3))
    before = [part.clone() for part in state.code]
    observation["context"] = a_context(seed=9, batch=3).numpy()
    _, state = agent.act(inputs_of(observation, np.array([False, True, False])), state)
    for old, new in zip(before, state.code, strict=True):
        assert torch.equal(old[[0, 2]], new[[0, 2]])
    assert not torch.equal(before[1][1], state.code.weights[1])


def test_agent_serves_maps_of_any_size(tmp_path, mazes):
    make_learner(mazes).save(tmp_path, {})
    agent = BeliefPlanner.build(Interface("local", 21, 21), checkpoint=tmp_path / "agent.safetensors")
    actions, _ = agent.act(inputs_of(an_observation(2, size=21), np.ones(2, dtype=bool)), agent.initial_state(2))
    assert actions.shape == (2,)

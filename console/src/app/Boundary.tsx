import { Component, type ReactNode } from "react";
import { Failure } from "./Failure";

interface Properties {
  children: ReactNode;
  /** What is shown: another one has not failed. */
  place?: string;
  /** Called before the children are shown again. */
  retry?: () => void;
}

interface State {
  error: unknown;
  place: string | undefined;
}

/** Keeps a failure of its children to their place on the page: STOP and the navigation stay. */
export class Boundary extends Component<Properties, State> {
  override state: State = { error: null, place: this.props.place };

  static getDerivedStateFromError(error: unknown): Partial<State> {
    return { error: error ?? new Error("unknown") };
  }

  static getDerivedStateFromProps({ place }: Properties, state: State): State | null {
    return place === state.place ? null : { error: null, place };
  }

  override render() {
    if (this.state.error === null) return this.props.children;
    const again = () => {
      this.props.retry?.();
      this.setState({ error: null });
    };
    return <Failure error={this.state.error} again={again} />;
  }
}

    <symbol name="{{number}}" type="line" alpha="1" clip_to_extent="1" force_rhr="0">
      <layer class="SimpleLine" enabled="1" locked="0" pass="0">
        <Option type="Map">
          <Option name="line_color" type="QString" value="{{fill}},220"/>
          <Option name="line_style" type="QString" value="solid"/>
          <Option name="line_width" type="QString" value="0.35"/>
          <Option name="line_width_unit" type="QString" value="MM"/>
          <Option name="capstyle" type="QString" value="round"/>
          <Option name="joinstyle" type="QString" value="round"/>
        </Option>
      </layer>
    </symbol>
